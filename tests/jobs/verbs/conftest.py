import pytest


@pytest.fixture
def call(twillight):
    """Run the command line; return the exit code, the output in one line, and the complaint."""

    def call(*tokens):
        code, said, told = twillight(*tokens)
        return code, " ".join(said.split()), told

    return call


@pytest.fixture
def refused(twillight):
    """Run a command that must be refused in one sentence; return it."""

    def refused(*tokens):
        code, _, told = twillight(*tokens)
        assert code == 2 and told.count("\n") == 1, (code, told)
        return told

    return refused
