"""The paper's figures, each drawn from traces or an evaluation alone."""
