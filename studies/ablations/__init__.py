"""What is each part of a recipe worth?"""
