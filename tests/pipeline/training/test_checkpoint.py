import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pipeline.training.checkpoint import State, read_checkpoint


def state(path, seed=0):
    torch.manual_seed(seed)
    network = torch.nn.Linear(2, 3)
    learner = State(network, torch.optim.AdamW(network.parameters()), 0.9, "identity", path)
    for step in range(3):
        loss = network(torch.ones(2)).square().sum()
        loss.backward()
        learner.optimiser.step()
        learner.add(step, loss.detach(), torch.tensor(1.0))
        learner.offer(step, abs(step - 1.0))
    learner.mark(3)
    return learner


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    path = tmp_path_factory.mktemp("checkpoint") / "checkpoint.safetensors"
    state(path).save(3)
    return path


def test_a_checkpoint_gives_all_state_back_and_one_of_another_training_none(saved):
    other = state(saved, seed=1)
    other.identity = "another"
    assert other.restore(torch.device("cpu")) == 0
    other.identity = "identity"
    assert other.restore(torch.device("cpu")) == 3
    expected = state(saved)
    assert other.curve == expected.curve
    assert other.best == expected.best == {"step": 1, "held_out_loss": 0.0}
    for name, tensor in expected.weights().items():
        assert torch.equal(other.weights()[name], tensor)
        assert torch.equal(other.weights(best=True)[name], expected.weights(best=True)[name])
        assert not torch.equal(other.weights(best=True)[name], tensor)


@given(st.data())
def test_no_flip_of_a_checkpoint_is_used(saved, data):
    """A flip that is not refused has changed nothing: the padding of the header, which no reader looks at."""
    whole = saved.read_bytes()
    place, mask = data.draw(st.integers(0, len(whole) - 1)), data.draw(st.integers(1, 255))
    damaged = saved.with_name("damaged.safetensors")
    damaged.write_bytes(whole[:place] + bytes([whole[place] ^ mask]) + whole[place + 1 :])
    found = read_checkpoint(damaged)
    if found is not None:
        about, tensors = read_checkpoint(saved)
        assert found[0] == about and found[1].keys() == tensors.keys()
        assert all(torch.equal(found[1][name], tensor) for name, tensor in tensors.items())
    elif damaged.exists():
        assert state(damaged).restore(torch.device("cpu")) == 0


@pytest.mark.parametrize("content", [b"", b"\0" * 7, b"PK\x03\x04 cut short", b"\x02\0\0\0\0\0\0\0{}"])
def test_what_is_no_checkpoint_counts_as_missing(tmp_path, content):
    path = tmp_path / "checkpoint.safetensors"
    assert read_checkpoint(path) is None
    path.write_bytes(content)
    assert read_checkpoint(path) is None
