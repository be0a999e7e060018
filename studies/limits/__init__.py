"""What limits accuracy?"""
