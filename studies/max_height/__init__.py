"""How high could the leg hop with its torques?"""
