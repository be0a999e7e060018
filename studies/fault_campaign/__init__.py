"""Is the leg safe whatever fails?"""
