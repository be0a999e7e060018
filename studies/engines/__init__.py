"""Do controllers hop in another physics engine as well?"""
