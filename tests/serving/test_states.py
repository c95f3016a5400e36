"""The states as a machine: whatever happens, a fault stays until it is reset, and nothing arms by itself."""

from __future__ import annotations

import itertools

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from drs_core.serving.states import ACTIVE, MOVING, Event, Stand, State, next_state


def test_every_state_has_one_sentence():
    assert len({state.value for state in State}) == len(State)
    assert all(state.value.endswith((".", "!")) for state in State)


def test_the_whole_table():
    for state, event in itertools.product(State, Event):
        after = next_state(state, event)
        if state is State.FAULT:
            assert after is (State.INACTIVE if event is Event.RESET else State.FAULT)
        if after in ACTIVE and state not in ACTIVE:
            assert (state, event) == (State.INACTIVE, Event.ACTIVATE) and after is State.WAITING
        if after in MOVING and state not in MOVING:
            assert (state, event) == (State.WAITING, Event.GOOD_INPUT)
        if state in ACTIVE and event is Event.FAULT:
            assert after is State.FAULT


def test_the_first_finding_of_a_fault_is_kept():
    stand = Stand().after(Event.CONFIGURE).after(Event.ACTIVATE).after(Event.FAULT, "First.")
    assert stand.after(Event.FAULT, "Second.").sentence == "First."
    assert stand.after(Event.RESET).sentence == State.INACTIVE.value


class States(RuleBasedStateMachine):
    """Events in any order, with work that begins and ends at any time."""

    def __init__(self) -> None:
        super().__init__()
        self.stand = Stand()
        self.work: list[int] = []
        self.told_to_go = False

    @rule(event=st.sampled_from(list(Event)), sentence=st.sampled_from(["", "Found."]))
    def happen(self, event, sentence):
        before, self.stand = self.stand, self.stand.after(event, sentence)
        assert self.stand.state is next_state(before.state, event)
        assert self.stand.epoch == before.epoch + (before.state in ACTIVE and self.stand.state not in ACTIVE)
        if event is Event.ACTIVATE and before.state is State.INACTIVE:
            self.told_to_go = True
        if self.stand.state not in ACTIVE:
            self.told_to_go = False
            # whatever began before may never count again
            assert all(epoch < self.stand.epoch for epoch in self.work)

    @precondition(lambda self: self.stand.state in ACTIVE)
    @rule()
    def begin_work(self):
        self.work.append(self.stand.epoch)

    @precondition(lambda self: self.stand.state is State.FAULT)
    @rule(events=st.lists(st.sampled_from([event for event in Event if event is not Event.RESET])))
    def a_fault_stays(self, events):
        for event in events:
            self.stand = self.stand.after(event, "Later.")
        assert self.stand.state is State.FAULT

    @invariant()
    def only_who_was_told_to_go_goes(self):
        assert (self.stand.state in ACTIVE) == self.told_to_go
        assert self.stand.sentence


TestStates = States.TestCase
TestStates.settings = settings(max_examples=100, stateful_step_count=40, deadline=None)
