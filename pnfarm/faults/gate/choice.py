"""How frames are chosen: independently, in bursts, by a Gilbert-Elliott model; the same for the engine and the gate.

The Gilbert-Elliott model (Gilbert 1960, Elliott 1963) is a Markov chain of a good and a bad state: a frame may first
change the state, then it is hit with the probability of the state.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pnfarm.faults.kind import Misfits, ParamSpec
from pnfarm.table.impairment import BURST, GILBERT_ELLIOTT, INDEPENDENT, threshold
from pnfarm.vocabulary.problem import Problem

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.station.splitmix import SplitMix64

__all__ = ["CHOICE_PARAMS", "Choice", "Chooser", "choice_misfits", "choice_of"]

MODELS = {"independent": INDEPENDENT, "burst": BURST, "gilbert-elliott": GILBERT_ELLIOTT}
_SHARE: dict[str, Any] = {"low": 0.0, "high": 1.0}
CHOICE_PARAMS = {
    "model": ParamSpec(
        "word",
        "Each frame by itself, bursts of one length, or bursts of random length (Gilbert-Elliott).  In each, "
        "`probability` is the share of frames that is lost.",
        default="independent",
        words=MODELS,
    ),
    "burst": ParamSpec(
        "whole number", "Length of a burst; for gilbert-elliott, of the bad state on average.", default=None,
        unit="frames", low=1, high=1_000_000,
    ),
    "good_to_bad": ParamSpec(
        "number", "gilbert-elliott, instead of `probability` and `burst`: change to the bad state.", default=None,
        **_SHARE,
    ),
    "bad_to_good": ParamSpec("number", "gilbert-elliott: change to the good state.", default=None, **_SHARE),
    "loss_bad": ParamSpec("number", "gilbert-elliott: share that is lost in the bad state.", default=None, **_SHARE),
    "loss_good": ParamSpec("number", "gilbert-elliott: share that is lost in the good state.", default=None, **_SHARE),
}  # fmt: skip
_OF_GILBERT = ("good_to_bad", "bad_to_good", "loss_bad", "loss_good")


@dataclass(frozen=True, slots=True)
class Choice:
    """``start`` is the probability of each frame, or of a burst's begin; the others are Gilbert-Elliott's."""

    model: int = INDEPENDENT
    start: float = 1.0
    burst: int = 1
    enter: float = 0.0
    leave: float = 0.0
    hit_good: float = 0.0
    hit_bad: float = 1.0

    def settings(self) -> Mapping[str, float]:
        """Fields of the engine's row."""
        return {
            "model": self.model,
            "burst": self.burst,
            "enter": threshold(self.enter),
            "leave": threshold(self.leave),
            "hit_good": threshold(self.hit_good),
            "hit_bad": threshold(self.hit_bad),
        }


class Chooser:
    """Chooses one frame after the other."""

    def __init__(self, choice: Choice, random: SplitMix64) -> None:
        self._choice = choice
        self._random = random
        #: Frames left of the burst; 1 in the bad state.
        self._left = 0

    def __call__(self) -> bool:
        choice = self._choice
        if choice.model == INDEPENDENT:
            return self._random.uniform() < choice.start
        if choice.model == BURST:
            if self._left:
                self._left -= 1
                return True
            begins = self._random.uniform() < choice.start
            self._left = choice.burst - 1 if begins else 0
            return begins
        changes = self._random.uniform() < (choice.leave if self._left else choice.enter)
        self._left ^= changes
        return self._random.uniform() < (choice.hit_bad if self._left else choice.hit_good)


def choice_of(spec: InjectionFields) -> Choice:
    """The model of an injection with :data:`CHOICE_PARAMS`, or of one without."""
    values = spec.values()
    model = MODELS[values.get("model", "independent")]
    share = 1.0 if spec.probability is None else spec.probability
    burst = values.get("burst") or 1
    if model == INDEPENDENT:
        return Choice(start=share)
    if model == BURST:
        # a burst may begin at each frame that no other one covers
        return Choice(BURST, 1.0 if share >= 1.0 else 1.0 / (1.0 + burst * (1.0 - share) / share), burst)
    good = values["loss_good"] or 0.0
    bad = 1.0 if values["loss_bad"] is None else values["loss_bad"]
    if values["good_to_bad"] is not None:
        enter, leave = values["good_to_bad"], values["bad_to_good"]
    else:
        in_bad = (share - good) / (bad - good)
        leave = 1.0 / burst
        enter = leave * in_bad / (1.0 - in_bad)
    return Choice(GILBERT_ELLIOTT, 1.0, 1, enter, leave, good, bad)


def choice_misfits(spec: InjectionFields) -> Misfits:
    """Parameters that contradict each other."""
    given = spec.params
    model = given.get("model", "independent")
    gilbert = [name for name in _OF_GILBERT if name in given]
    if model not in MODELS:
        return
    if model != "gilbert-elliott":
        for name in gilbert:
            yield f"params.{name}", Problem(f"means nothing for the model {model}", "model: gilbert-elliott")
    if model == "independent":
        if "burst" in given:
            yield "params.burst", Problem("means nothing for the model independent", "model: burst or gilbert-elliott")
        return
    if model == "burst":
        if "burst" not in given:
            yield "params.burst", Problem("is missing", "the length of a burst in frames")
        return
    yield from _gilbert_misfits(spec)


def _gilbert_misfits(spec: InjectionFields) -> Misfits:
    given = spec.params
    changes = [name for name in ("good_to_bad", "bad_to_good") if name in given]
    if changes:
        for name in ("good_to_bad", "bad_to_good"):
            if name not in given:
                yield f"params.{name}", Problem("is missing", f"a number from 0 to 1, as {changes[0]} is given")
        if spec.probability is not None:
            yield "probability", Problem("follows from good_to_bad and bad_to_good", "one of the two")
        if "burst" in given:
            yield "params.burst", Problem("follows from bad_to_good", "one of the two")
        return
    if "burst" not in given:
        yield "params.burst", Problem("is missing", "the mean length of the bad state, or good_to_bad and bad_to_good")
        return
    try:
        values = spec.values()
    except Problem:
        return
    good = values["loss_good"] or 0.0
    bad = 1.0 if values["loss_bad"] is None else values["loss_bad"]
    share = 1.0 if spec.probability is None else spec.probability
    if not good < share < bad:
        allowed = f"a number between loss_good ({good:g}) and loss_bad ({bad:g})"
        yield "probability", Problem(f"is {share:g}", allowed)
        return
    most = (values["burst"] * bad + good) / (values["burst"] + 1)
    if share > most:
        yield "probability", Problem(f"is {share:g}", f"at most {most:.6g} with bad states of {values['burst']} frames")
