"""How fine must the physics step be?"""
