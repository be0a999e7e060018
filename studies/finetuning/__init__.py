"""What does continued training on a leg bring?"""
