"""Continued training on a robot that is reached through outings alone (paper, "Conclusion").

A given policy goes on learning on the real leg, or on a twin that plays it. Nobody tells the true
state there: an outing returns what the encoders reported (``control.outing``). From that alone

- ``contact`` reads off afterwards when the foot was in the air, ``estimate`` how high it went;
- ``replay`` makes the transitions that the environment would have given;
- ``aim`` tells the network another command, so that hops come true on average: two numbers;
- ``learner`` goes on with soft actor-critic from the policy's own weights.

``finetuning`` alternates outings and learning, keeps the best, throws back what became worse, and
stops by itself.
"""
