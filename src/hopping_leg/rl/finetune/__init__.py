"""Continued training on a robot that is reached through trials alone (paper, "Conclusion").

A given policy goes on learning on the real leg, or on a twin that plays it. Nobody tells the true
state there: a trial returns what the encoders reported (``hardware_trial``). From that alone

- ``apex_estimate`` tells afterwards when the foot was in the air, and how high the base went;
- ``replay`` makes the transitions that the environment would have given;
- ``command_correction`` gives the network another command, so that the mean error vanishes;
- ``learner`` goes on with soft actor-critic from the policy's own weights.

``finetuning`` alternates trials and learning, keeps the best, rolls back what became worse, and
stops by itself.
"""
