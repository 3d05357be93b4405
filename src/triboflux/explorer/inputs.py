"""From the texts in the fields of the page to a case, or to a sentence at each wrong field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, cast

from triboflux import presets
from triboflux.case import MODEL_NAMES, Case
from triboflux.errors import InputError, shown
from triboflux.explorer.fields import FIELDS, NUMBERS, SUSPENSION, preset_texts, starts
from triboflux.model_errors import POINTS

MOST_MODELS = 3
"""How many models are drawn at a time."""

_LONGEST_TEXT = 300


@dataclass(frozen=True)
class Inputs:
    """What the page asks for.

    Attributes
    ----------
    case : Case or None
        Of the model ``"full"``; None if something is wrong.
    models : tuple of str
        To be drawn, the most complete first.
    errors : dict of str to str
        A sentence by the name of the field that it stands at; the empty name is the whole form.
    texts : dict of str to str
        What stands in all fields.
    """

    case: Case | None
    models: tuple[str, ...] = ()
    errors: dict[str, str] = field(default_factory=dict[str, str])
    texts: dict[str, str] = field(default_factory=dict[str, str])


def read(values: Mapping[str, Any]) -> Inputs:
    """Return the case that the page's fields describe.

    Parameters
    ----------
    values : mapping
        ``kind`` (`NUMBERS` or `SUSPENSION`), ``closures``, ``preset``, ``models`` (a list of
        names), and ``fields``: a text for each name in `FIELDS`. Anything else is ignored, and
        nothing is trusted.
    """
    errors: dict[str, str] = {}
    usual = starts()
    texts = usual | _texts(values.get("fields"))
    given = dict(texts)
    models = _models(values.get("models"), errors)
    kind = SUSPENSION if values.get("kind") == SUSPENSION else NUMBERS
    for name, text in texts.items():
        if len(text) > _LONGEST_TEXT:
            errors[name] = f"{name} has {len(text)} characters, but may have {_LONGEST_TEXT}."
            texts[name] = usual[name]
    while True:
        try:
            case = Case(**_tables(kind, texts, values))
            break
        except InputError as error:
            name = _field_of(error)
            told = str(error) if error.field is None else str(_alone(error))
            if name is None or name in errors or texts[name] == usual[name]:
                errors[name or ""] = told
                return Inputs(None, models, errors, given)
            # the others are looked at as if this one were right
            errors[name], texts[name] = told, usual[name]
    return Inputs(None if errors else case, models, errors, given)


def _texts(given: object) -> dict[str, str]:
    """Return the texts of known fields."""
    if not isinstance(given, Mapping):
        return {}
    table = cast("Mapping[object, object]", given)
    return {name: str(table[name]).strip() for name in FIELDS if isinstance(table.get(name), str)}


def _models(given: object, errors: dict[str, str]) -> tuple[str, ...]:
    """Return the chosen models in the order of the hierarchy, or note what is wrong."""
    chosen = cast("list[object]", given) if isinstance(given, list) else []
    known = tuple(name for name in MODEL_NAMES if name in chosen)
    if not 1 <= len(known) <= MOST_MODELS:
        errors["models"] = f"models are {len(known)}, but must be from 1 to {MOST_MODELS}."
    return known[:MOST_MODELS]


def _alone(error: InputError) -> InputError:
    """Return the sentence about one field without the count of others."""
    assert error.field is not None
    return InputError.about(error.field, error.problem, hint=error.hint)


def _field_of(error: InputError) -> str | None:
    """Return the field of the page that an error is about."""
    if error.field is None:
        return None
    name = error.field.partition("[")[0]
    name = {"initial.charge": "initial.waves"}.get(name, name)
    return name if name in FIELDS else None


def _tables(kind: str, texts: Mapping[str, str], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of a case, not validated; a text that is no number stays one."""
    dimensions = 2 if texts["grid.dimensions"] == "2" else 1
    waves = _whole(texts["initial.waves"])
    if not isinstance(waves, int) or not 1 <= waves <= 1000:
        problem = f"is {shown(waves)}, but must be a whole number from 1 to 1000"
        raise InputError.about("initial.waves", problem)
    run: dict[str, Any] = {"t_end": _quantity(texts["run.t_end"])}
    if texts["run.stop_at_peak_charge"]:
        run["stop_at_peak_charge"] = _quantity(texts["run.stop_at_peak_charge"])
    points = _whole(texts["grid.points"])
    # few points are worked on as they are, so that all cases share the same compiled programs
    run["adaptive_points"] = dimensions > 1 or points != POINTS
    tables: dict[str, Any] = {
        "title": texts["title"],
        "closures": values.get("closures", "derived"),
        "grid": {"points": [points] * dimensions},
        "initial": {"charge": [{"mode": [waves] * dimensions, "sine": -1.0}]},
        "run": run,
    }
    return tables | {kind: _table(kind, texts, values)}


def _table(kind: str, texts: Mapping[str, str], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the seven numbers, or the fields of a suspension."""
    own = {
        name.partition(".")[2]: text for name, text in texts.items() if name.startswith(f"{kind}.")
    }
    if kind == NUMBERS:
        return {name: _quantity(text) for name, text in own.items()}
    table: dict[str, Any] = {
        name: text if FIELDS[f"{kind}.{name}"].options else _with_unit(name, text)
        for name, text in own.items()
    }
    preset = values.get("preset")
    if preset in presets.NAMES:
        marked = presets.fill(preset, {})
        same = table["youngs_modulus"] == preset_texts(preset)["suspension.youngs_modulus"]
        table["softened_modulus"] = bool(marked.get("softened_modulus", False)) and same
    return table


def _with_unit(name: str, text: str) -> Any:
    """Return a quantity of a suspension; a bare number is in the unit of the field."""
    value = _quantity(text)
    unit = FIELDS[f"suspension.{name}"].unit
    return f"{text} {unit}" if unit and isinstance(value, float) else value


def _quantity(text: str) -> Any:
    """Return a number if a text is one, otherwise the text."""
    try:
        return float(text)
    except ValueError:
        return text


def _whole(text: str) -> Any:
    """Return a whole number if a text is one, otherwise the text."""
    try:
        return int(text)
    except ValueError:
        return text
