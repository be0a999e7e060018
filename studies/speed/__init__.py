"""How fast are environment, policies, viewer and control loop?"""
