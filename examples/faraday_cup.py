"""Make the measurements of a tutorial, faraday_cup.csv and faraday_pail.csv, from simulated grains.

    python examples/faraday_cup.py

Grains are simulated by the collision rule alone, with the beta and gamma that follow from their
diameter and Young's modulus; no moment model takes part. Two experiments with the same beads:

- A bed with two layers of opposite charge, examples/layered_bed.toml. A scoop from the bottom
  centimetre (0 to L/16) in a Faraday cup gives the mean charge. The simulation follows 2500 grains
  there, 1.5 g, so the mean of a sample scatters by itself; the electrometer adds its own error.
- The same bed charged by tumbling: grains of both signs, everywhere alike. 100 of them, dropped one
  after another through a Faraday pail, give the standard deviation of their charges; the pail adds
  its own error to each of them.

The simulations take some minutes.
"""

import csv
from pathlib import Path

import numpy as np

import triboflux as tbf

FOLDER = Path(__file__).parent
SAMPLED = 1 / 16  # of the box, from the bottom of the bed
GRAINS = 100  # that are measured one by one
CUP_ERROR = 5e-4  # of the cup's reading, uC/kg
PAIL_ERROR = 2e-3  # of a single grain's reading, uC/kg
SEED = 20261122


def tumbled(case):
    """Return the case of a bed without layers; it is uniform, so few grains and cells will do."""
    tables = case.model_dump(exclude={"numbers"})
    tables["title"] = "Charged by tumbling"
    tables["initial"]["charge"] = ()
    tables["grid"]["points"] = (8,)
    tables["kinetic"] |= {"particles": 5_000, "cells": 200}
    return tbf.Case(**tables)


def cup_readings(result, random):
    """Return the mean charge of the samples, uC/kg."""
    bottom = result.dataset.charge.isel(x=slice(0, round(SAMPLED * result.dataset.sizes["x"])))
    mean = bottom.mean("x").values * 1e6 / result.case.suspension.mass
    return mean + CUP_ERROR * random.standard_normal(mean.shape)


def pail_readings(result, random):
    """Return the standard deviation of the grains' charges, uC/kg."""
    variance = result.dataset.variance.mean("x").values * (1e6 / result.case.suspension.mass) ** 2
    # the squares of normal deviates, as many as grains but one for their mean
    squares = random.chisquare(GRAINS - 1, variance.shape) / (GRAINS - 1)
    return np.sqrt((variance + PAIL_ERROR**2) * squares)


def write(name, heading, result, readings):
    """Write times and readings as comma-separated values."""
    with open(FOLDER / name, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time [s]", heading])
        for time, reading in zip(result.dataset.time.values, readings, strict=True):
            writer.writerow([f"{time:g}", f"{reading:.5f}"])


def main():
    """Simulate both beds and write both files."""
    case = tbf.Case.from_toml(FOLDER / "layered_bed.toml")
    random = np.random.default_rng(SEED)
    layered = tbf.simulate(case).to_si()
    write("faraday_cup.csv", "charge [uC/kg]", layered, cup_readings(layered, random))
    mixed = tbf.simulate(tumbled(case)).to_si()
    write("faraday_pail.csv", "scatter [uC/kg]", mixed, pail_readings(mixed, random))
    print(f"beta  = {case.suspension.field_transfer:.4e} C/(V/m)/(m/s)^0.8")
    print(f"gamma = {case.suspension.charge_transfer:.4e} /(m/s)^0.8")


if __name__ == "__main__":
    main()
