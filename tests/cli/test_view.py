import re
import socket
import subprocess
import sys
import urllib.request

import pytest

pytest.importorskip("viser", reason="the extra 'view' is not installed")


@pytest.mark.slow
def test_the_page_is_served_on_this_computer_alone_and_a_taken_port_gives_the_next():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        command = [sys.executable, "-m", "hopping_leg.cli", "view", "--no-browser"]
        with subprocess.Popen([*command, "--port", str(port)], stdout=subprocess.PIPE) as process:
            try:
                line = process.stdout.readline().decode()
                address = re.search(r"http://127\.0\.0\.1:(\d+)", line)
                assert int(address[1]) != port
                page = urllib.request.urlopen(address[0], timeout=30).read()
            finally:
                process.terminate()
    assert b"<html" in page
