"""What do policies know of contact, phase and height?"""
