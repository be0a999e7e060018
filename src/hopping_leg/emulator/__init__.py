"""Two emulated moteus drives that turn the simulated leg behind a real wire protocol.

    host --bytes--> port --frames--> bus --registers--> drive --torque--> leg
         <--bytes--      <--frames--     <--registers--      <--angles---

Everything but ``server`` and ``ports`` takes time as an argument and does nothing by
itself, so that drive logic is tested with a clock moved by hand.
"""
