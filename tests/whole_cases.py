"""Whole case files, as users write them: good ones, and good ones with one thing wrong."""

import copy
import datetime
import math

import tomli_w
from hypothesis import strategies as st

GRIDS = ((8,), (6, 5), (4, 4, 4))
"""Few, because each is compiled for each model."""
MODELS = ("full", "semi-algebraic", "algebraic", "gradient", "collisional")

_POWDERS = ("polyethylene", "glass-beads")


def _powers(low, high):
    """Return numbers between powers of ten, as people type them."""
    return st.builds(
        lambda mantissa, power: float(f"{mantissa}e{power}"),
        st.integers(1, 9),
        st.integers(low, high),
    )


def _modes(points, constant=False):
    waves = st.tuples(*(st.integers(-((n - 1) // 3), (n - 1) // 3) for n in points))
    return st.fixed_dictionaries(
        {"mode": waves.filter(lambda mode: constant or any(mode)).map(list)},
        optional={"sine": st.floats(-1, 1), "cosine": st.floats(-1, 1)},
    )


_numbers = st.fixed_dictionaries(
    {
        "peclet": _powers(3, 7) | st.just(math.inf),
        "tau_c": _powers(-4, -1),
        "energy_ratio": st.just(0) | _powers(0, 2),
        "length_ratio": st.sampled_from([50, 192.0, 1e3]),
        "restitution": st.sampled_from([1, 0.9, 0.5]),
    },
    optional={
        "tau_p": st.just(math.inf) | _powers(-2, 1),
        "tau_sigma": st.just(math.inf) | _powers(-1, 2),
    },
)

_suspension = st.fixed_dictionaries(
    {"preset": st.sampled_from(_POWDERS)},
    optional={
        "diameter": st.sampled_from(["300 um", 5e-4]),
        "solid_fraction": st.floats(0.05, 0.4),
        "granular_temperature": st.sampled_from(["1e-3 m^2/s^2", 2e-2]),
        "charge_scale": st.sampled_from(["1 pC", "2 uC/kg", "1e-6 C/m^2"]),
        "drag": st.sampled_from(["none", "wen-yu"]),
    },
)


_kinetic = st.fixed_dictionaries(
    {
        "particles": st.just(1000),
        "ensembles": st.just(2),
        "dilute": st.just(True),
        "seed": st.integers(0, 10**18),
    },
    optional={
        "thermostat": st.sampled_from(["full", "mean-velocity", "none"]),
        "mean_field": st.booleans(),
    },
)

PROGRAMS = tuple((points, model) for points in GRIDS for model in MODELS)
"""Grids and models, each of which is compiled once for each set of rules to stop by."""
ONE = (((6, 5), "full"),)


@st.composite
def tables(draw, programs=PROGRAMS):
    """Return the tables of a case that is allowed, and runs within a fraction of a second.

    Parameters
    ----------
    programs : sequence of (tuple of int, str)
        Grids and models; a model "kinetic" stands for particles. With a single one, rules to stop
        by and numbers of outputs are the same in all cases, so that one compiled program serves.
    """
    in_si = draw(st.booleans())
    points, model = draw(st.sampled_from(programs))
    kinetic, various = model == "kinetic", len(programs) > 1
    if kinetic:
        in_si, model = False, "full"
    closures = draw(st.sampled_from(["derived", "published", "complete"]))
    table = {"model": model, "closures": closures}
    if draw(st.booleans()):
        table["title"] = draw(st.text(st.characters(codec="utf-8", categories=["L", "N"])))
    if closures != "published" and not in_si and draw(st.booleans()):
        table["exponent"] = draw(st.sampled_from([0.8, 0, 1.0, 0.6]))
    table |= {"suspension": draw(_suspension)} if in_si else {"numbers": draw(_numbers)}
    if not various and not kinetic:
        _switch_on(draw, table)
    table["grid"] = {"points": list(points)}
    if (various or kinetic) and draw(st.booleans()):
        length = ["5 cm", 1.0, 2] if in_si else [1.0, 2, 0.5]
        table["grid"]["lengths"] = [draw(st.sampled_from(length)) for _ in points]
    table["initial"] = _initial(draw, points, model)
    table["run"] = _run(draw, model, various)
    if kinetic:
        table["kinetic"] = draw(_kinetic)
        table["initial"].pop("covariance", None)
        # collisions cost time, those of thousands of mean free times minutes
        table["numbers"]["tau_c"] = draw(_powers(-2, -1))
        table["numbers"].pop("tau_p", None)
    return table


def _switch_on(draw, table):
    """Let every mechanism act, because without one there may be another program."""
    if "suspension" in table:
        table["suspension"].pop("drag", None)
        return
    table["numbers"] |= {
        "peclet": draw(_powers(3, 7)),
        "energy_ratio": draw(_powers(0, 2)),
        "tau_p": draw(_powers(-2, 1)),
        "tau_sigma": draw(_powers(-1, 2)),
    }


def _run(draw, model, various):
    t_end = draw(_powers(-3, -1))
    run = {"t_end": t_end, "allow_out_of_range": True, "rtol": draw(st.sampled_from([1e-3, 1e-6]))}
    counts = st.sampled_from([1, 2, 7]) if various else st.just(3)
    most = 4 if various else 3
    times = st.sets(st.floats(0, t_end), min_size=1 if various else most, max_size=most)
    run["outputs"] = draw(counts | times.map(sorted))
    if draw(st.booleans()):
        run["atol"] = draw(st.sampled_from([0, 1e-9, 1e-6]))
    if various and draw(st.integers(0, 3)) == 0:
        run["stop_at_rate"] = draw(st.sampled_from([1e-6, 1e3]))
    if various and model in MODELS[:3] and draw(st.integers(0, 3)) == 0:
        run["realizability_bound"] = draw(_powers(-3, 0))
    return run


def _initial(draw, points, model):
    initial = {"charge": draw(st.lists(_modes(points), max_size=3))}
    if draw(st.booleans()):
        initial["variance"] = [{"mode": [0] * len(points), "cosine": draw(st.floats(0, 2))}]
    if draw(st.integers(0, 3)) == 0:
        component = st.integers(0, len(points) - 1)
        initial["covariance"] = [{"component": draw(component)} | draw(_modes(points, True))]
    if draw(st.integers(0, 3)) == 0:
        initial["charge"].append({"mode": [0] * len(points), "cosine": draw(st.floats(-1, 1))})
        initial["neutralising_background"] = True
    return initial


@st.composite
def texts(draw, programs=PROGRAMS):
    """Return the TOML of a case that is allowed, in one of several styles."""
    return draw(styled(draw(tables(programs))))


@st.composite
def styled(draw, given_tables):
    """Return a TOML document of some tables, in one of several styles."""
    style = draw(st.sampled_from(["tables", "dotted", "inline", "windows"]))
    if style == "dotted":
        lines = [
            f"{_key(name)}.{_key(key)} = {_inline(value)}"
            for name, table in given_tables.items()
            if isinstance(table, dict)
            for key, value in table.items()
        ]
        return _plain(given_tables) + "\n".join(lines) + "\n"
    if style == "inline":
        pairs = [
            f"{_key(name)} = {_inline(table)} # all of it"
            for name, table in given_tables.items()
            if isinstance(table, dict)
        ]
        return _plain(given_tables) + "\n".join(pairs) + "\n"
    text = tomli_w.dumps(given_tables)
    return "\ufeff" + text.replace("\n", "\r\n") if style == "windows" else text


def _plain(given_tables):
    return tomli_w.dumps({k: v for k, v in given_tables.items() if not isinstance(v, dict)})


def _key(key):
    """Return a key, quoted unless it is a plain word."""
    return tomli_w.dumps({key: 1}).removesuffix(" = 1\n")


def _inline(value):
    """Return any value on one line of TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_inline(v)}" for key, v in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return tomli_w.dumps({"x": value}).removeprefix("x = ").strip()


# ------------------------------------------------------------------ one thing wrong

_DEEP = (50, 400, 3000)
_KEYS = ("modle", "größe", "ключ", "a b", "", "x" * 300, "numbers", "\u202e", "__class__")
_TEXTS = ("", "full ", "5 apples", "1e5 km", "NaN", "__import__('os')", "٣", "\u202e", "a" * 5000)
_REQUIRED = {
    "numbers": ("peclet", "tau_c", "energy_ratio", "length_ratio", "restitution"),
    "grid": ("points",),
    "run": ("t_end",),
}
# a number that other fields have to fit may be told by the name of one of these
_TOLD_BY = {
    "points": ("initial", "lengths"),
    "lengths": ("points",),
    "outputs": ("t_end",),
    "t_end": ("outputs",),
    "closures": ("exponent",),
    "exponent": ("closures",),
    "model": ("realizability_bound",),
    "cosine": ("initial",),
    "sine": ("initial",),
    "mode": ("initial",),
    "preset": ("suspension",),
}


def _values():
    """Return values that hardly any field accepts."""
    wrong = st.sampled_from(
        [
            math.nan,
            math.inf,
            -math.inf,
            -1,
            -1e-300,
            0,
            True,
            10**400,
            -(2**63),
            1e308,
            [],
            {},
            [[1]],
            {"a": {"b": [1, "c"]}},
            datetime.date(1979, 5, 27),
            datetime.datetime(1979, 5, 27, 7, 32, tzinfo=datetime.UTC),
            datetime.time(7, 32),
        ]
    )
    return wrong | wrong | wrong | st.sampled_from(_TEXTS) | st.text(max_size=20) | st.integers()


def _leaves(table, path=()):
    """Yield the path of every value in nested tables and lists."""
    pairs = table.items() if isinstance(table, dict) else enumerate(table)
    for key, value in pairs:
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from _leaves(value, (*path, key))


def _at(table, path):
    for step in path:
        table = table[step]
    return table


@st.composite
def wrong_texts(draw, programs=PROGRAMS):
    """Return a case with one thing changed, what has to be told, and whether it must be refused.

    Returns
    -------
    text : str
        Of the case.
    told : tuple of str
        Names of which a sentence has to contain one; any will do if there are none.
    surely : bool
        Whether it is not allowed; other values, and other texts, may be allowed all the same.
    """
    table = copy.deepcopy(draw(tables(programs)))
    change = draw(st.sampled_from(["value", "value", "value", "key", "missing", "deep", "text"]))
    told = ()
    if change == "value":
        path = draw(st.sampled_from(list(_leaves(table))))
        value = draw(_values())
        _at(table, path[:-1])[path[-1]] = value
        words = [step for step in path if isinstance(step, str)]
        told = (words[-1], *_TOLD_BY.get(words[-1], ()))
        if words[0] in ("numbers", "suspension"):
            told += (words[0],)
    elif change == "key":
        owners = [(), *((name,) for name, inner in table.items() if isinstance(inner, dict))]
        key = draw(st.sampled_from(_KEYS) | st.text(max_size=20))
        owner = _at(table, draw(st.sampled_from(owners)))
        if key not in owner:
            owner[key] = draw(_values())
            told = (key, "not a known key", "control character", "numbers")
    elif change == "missing":
        name = draw(st.sampled_from([name for name in _REQUIRED if name in table]))
        key = draw(st.sampled_from((None, *_REQUIRED[name])))
        told = (name if key is None else key,)
        table.pop(name) if key is None else table[name].pop(key)
    surely = change in ("missing", "deep") or (change == "key" and bool(told))
    text = draw(styled(table))
    if change == "deep":
        nested = "[" * (depth := draw(st.sampled_from(_DEEP))) + "]" * depth
        mark = "\ufeff" if text.startswith("\ufeff") else ""
        return f"{mark}deep = {nested}\n{text.removeprefix(mark)}", ("deep",), surely
    if change == "text":
        text, told = _spoilt(draw, text), ()
    return text, told, surely


def _spoilt(draw, text):
    """Return a text that is hardly TOML any more."""
    place = draw(st.integers(0, len(text)))
    part = draw(
        st.text(min_size=1, max_size=8)
        | st.sampled_from(["\x00", "=", "]", "[[", '"""', "9" * 5000, "a." * 5000, "\n" * 2**20])
    )
    return text[:place] + part + text[place + draw(st.integers(0, 20)) :]
