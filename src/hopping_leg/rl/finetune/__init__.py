"""Continued training on a robot that is reached through trials alone (paper, "Conclusion").

Nobody tells the true state there: a trial returns what the encoders reported (``hardware_trial``).
From that alone ``apex_estimate`` tells afterwards when the foot was in the air, and how high the
base went; ``finetuning`` corrects the policy's command by what its hops miss, keeps the best, rolls
back what became worse, and stops by itself.
"""
