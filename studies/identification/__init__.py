"""How well and how fast are legs identified?"""
