"""The robot driven for real: wire, supervisor, loop, black box, and an emulator to prove it."""
