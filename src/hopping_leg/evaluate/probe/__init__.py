"""How well contact, phase and height can be read off a policy's hidden layers by a linear map."""
