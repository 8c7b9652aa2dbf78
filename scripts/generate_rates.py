#!/usr/bin/env python3
"""Generates the rate traces of tc_profiles/generated-cellular.toml, in Mahimahi's format.

    scripts/generate_rates.py            write tc_profiles/traces/generated-cellular-{up,down}.mahi
    scripts/generate_rates.py --check    compare them with what would be written; exit code 1: they differ

One integer per line, in ms since the start, each an opportunity to send 1500 bytes; the last line is also the
length of the trace. Nothing here is measured: the rate of a moving modem is modelled as the product of

  the mean rate of the direction,
  shadowing: log-normal, correlated over seconds, as hills and houses pass,
  fast fading and the scheduler: exponential (the power of a Rayleigh channel), correlated over tens of ms,
  handovers: no opportunities for tens to hundreds of ms, at exponential gaps.

Opportunities come in whole ms, several at once, as radio blocks do. One seed gives the same files everywhere.
"""
import argparse
import math
import pathlib
import random
import sys

SEED = 1
LENGTH_MS = 60_000
BITS = 1500 * 8
# Mbit/s. No measurement behind these values: they only have to lie in the range of LTE while driving, and keep
# the files small.
MEAN_MBIT = {"up": 6.0, "down": 12.0}
# The standard deviation of shadowing in nepers of the rate, and its correlation time: 8 dB of power and 50 m at
# 10 m/s (Gudmundson: "Correlation model for shadow fading in mobile radio systems", 1991), compressed by half as
# the rate goes with the logarithm of the power.
SHADOW_SD = 0.5
SHADOW_TAU_MS = 5_000
# No measurement behind this value: it only has to be of the order of a scheduler's rounds and of fading at the
# speed of a car.
FADE_TAU_MS = 40
# The share of the rate that fading never takes away, since coding and retransmissions fill the deepest fades.
FADE_FLOOR = 0.2
# No measurement behind these values: a handover now and then, each well below a second.
HANDOVER_GAP_MS = 20_000
HANDOVER_MS = (40, 300)


def correlated(rng, tau_ms):
    """A stationary normal process of unit variance, one value a millisecond."""
    keep = math.exp(-1 / tau_ms)
    fresh = math.sqrt(1 - keep * keep)
    value = rng.gauss(0, 1)
    while True:
        yield value
        value = keep * value + fresh * rng.gauss(0, 1)


def rates(rng, mean_mbit):
    """The rate in each millisecond, in bits; its mean is exactly the one asked for."""
    shadow = correlated(rng, SHADOW_TAU_MS)
    real, imaginary = correlated(rng, FADE_TAU_MS), correlated(rng, FADE_TAU_MS)
    out = []
    handover_at = rng.expovariate(1 / HANDOVER_GAP_MS)
    handover_until = -1.0
    for ms in range(LENGTH_MS):
        if ms >= handover_at:
            handover_until = ms + rng.uniform(*HANDOVER_MS)
            handover_at = handover_until + rng.expovariate(1 / HANDOVER_GAP_MS)
        fading = (next(real) ** 2 + next(imaginary) ** 2) / 2
        rate = math.exp(SHADOW_SD * next(shadow)) * (FADE_FLOOR + (1 - FADE_FLOOR) * fading)
        out.append(0.0 if ms < handover_until else rate)
    scale = mean_mbit * 1000 * LENGTH_MS / sum(out)
    return [rate * scale for rate in out]


def trace(direction):
    rng = random.Random(f"{SEED} {direction}")
    lines = []
    credit = 0.0
    for ms, bits in enumerate(rates(rng, MEAN_MBIT[direction]), start=1):
        credit += bits
        while credit >= BITS:
            credit -= BITS
            lines.append(ms)
    lines[-1] = LENGTH_MS
    return "".join(f"{ms}\n" for ms in lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="only compare the files with what would be written")
    check = parser.parse_args().check
    folder = pathlib.Path(__file__).resolve().parent.parent / "tc_profiles" / "traces"
    stale = 0
    for direction in MEAN_MBIT:
        path = folder / f"generated-cellular-{direction}.mahi"
        text = trace(direction)
        if not check:
            path.write_text(text)
        elif not path.exists() or path.read_text() != text:
            print(f"{path}: differs from what scripts/generate_rates.py writes; run it", file=sys.stderr)
            stale += 1
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
