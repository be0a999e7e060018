"""Does what was trained in simulation hop on the real leg? The paper's claim, tried on twins."""
