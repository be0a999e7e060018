"""How good is a training after how long?"""
