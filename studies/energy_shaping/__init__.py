"""What is each part of energy shaping worth?"""
