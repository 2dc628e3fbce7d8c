"""Programs with one mistake each, which a scenario in `configs/pick-and-place` finds."""

from pick_and_place import MILLISECONDS, PickAndPlace


class NoEndPosition(PickAndPlace):
    """It does not wait for the gripper's sensors."""

    def closed(self, inputs, now):
        return True

    def held(self, inputs):
        return True

    def opened(self, inputs, now):
        return True


class TimeInsteadOfFeedback(PickAndPlace):
    """It waits for as long as the gripper usually takes."""

    def closed(self, inputs, now):
        return now - self.since > 120 * MILLISECONDS

    def held(self, inputs):
        return True

    def opened(self, inputs, now):
        return now - self.since > 120 * MILLISECONDS


class NoPartCheck(PickAndPlace):
    """It picks whether a part is there or not."""

    def may_pick(self, inputs):
        return inputs.gripper_open


class IgnoresJam(PickAndPlace):
    """A gripper that does not close stops it without a word."""

    def watch(self, inputs, now):
        self.alarm = False


class CarriesOpen(PickAndPlace):
    """It goes on with a gripper that has opened on the way."""

    def held(self, inputs):
        return True

    def watch(self, inputs, now):
        self.alarm = self.step in ("close", "open") and now - self.since > 1000 * MILLISECONDS


class LosesCount(PickAndPlace):
    """It begins to count at 0 when a connection was lost."""

    def lost(self):
        self.count = 0
