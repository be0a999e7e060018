"""A stand-in for the Hugging Face hub: what `huggingface_hub` asks of it for policies."""

import base64
import contextlib
import hashlib
import json
import re
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import yaml


class Hub:
    """Repositories as dictionaries, file name to content; ``token`` opens them for writing."""

    def __init__(self):
        self.repositories, self.private, self.token = {}, set(), "hf_right"
        self.downloads = []

    def commit(self, name):
        """Return the only commit of a repository."""
        content = b"".join(k.encode() + v for k, v in sorted(self.repositories[name].items()))
        return hashlib.sha1(content).hexdigest()

    def about(self, name):
        """Return what is known of a repository."""
        files = self.repositories[name]
        tags = (
            yaml.safe_load(files["README.md"].split(b"---\n")[1])["tags"]
            if "README.md" in files
            else []
        )
        return {
            "id": name, "modelId": name, "sha": self.commit(name), "private": name in self.private,
            "tags": tags, "lastModified": "2026-01-02T03:04:05.000Z",
            "siblings": [{"rfilename": f, "size": len(c)} for f, c in files.items()],
        }  # fmt: skip


class _Handler(BaseHTTPRequestHandler):
    hub: Hub

    def log_message(self, *_):
        """Say nothing."""

    def answer(self, code, content=b"", **headers):
        body = content if isinstance(content, bytes) else json.dumps(content).encode()
        self.send_response(code)
        for name, value in {"Content-Length": str(len(body)), **headers}.items():
            self.send_header(name.replace("_", "-"), value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def do_HEAD(self):
        self.do_GET()

    def do_GET(self):
        path, _, query = self.path.partition("?")
        repositories = self.hub.repositories
        if path == "/api/models":
            assert "filter=hopping-leg" in query
            self.answer(
                200, [a for n in repositories if "hopping-leg" in (a := self.hub.about(n))["tags"]]
            )
        elif found := re.fullmatch(r"/api/models/(\w+/[\w-]+)(/revision/(.*))?", path):
            if found[1] not in repositories:
                self.answer(404, X_Error_Code="RepoNotFound")
            elif found[3] not in (None, "main", self.hub.commit(found[1])):
                self.answer(404, X_Error_Code="RevisionNotFound")
            else:
                self.answer(200, self.hub.about(found[1]))
        elif found := re.fullmatch(r"/(\w+/[\w-]+)/resolve/(\w+)/(.*)", path):
            content = repositories[found[1]][found[3]]
            self.hub.downloads.append(found[3])
            tag = f'"{hashlib.sha1(content).hexdigest()}"'
            self.answer(200, content, ETag=tag, X_Repo_Commit=found[2])
        else:
            self.answer(404)

    def do_POST(self):
        content = self.rfile.read(int(self.headers["Content-Length"]))
        if self.path == "/api/validate-yaml":
            self.answer(200, {"errors": _faults(json.loads(content)["content"]), "warnings": []})
        elif self.headers.get("Authorization") != f"Bearer {self.hub.token}":
            self.answer(401)
        elif self.path == "/api/repos/create":
            asked = json.loads(content)
            name = f"{asked['organization']}/{asked['name']}"
            if name in self.hub.repositories:
                self.answer(409, {"url": self.url(name)})
                return
            self.hub.repositories[name] = {}
            self.hub.private |= {name} if asked.get("visibility") == "private" else set()
            self.answer(200, {"url": self.url(name)})
        elif re.fullmatch(r"/api/models/\w+/[\w-]+/preupload/main", self.path):
            files = json.loads(content)["files"]
            plain = {"uploadMode": "regular", "shouldIgnore": False}
            self.answer(200, {"files": [{"path": f["path"], **plain} for f in files]})
        elif found := re.fullmatch(r"/api/models/(\w+/[\w-]+)/commit/main", self.path):
            for line in map(json.loads, content.splitlines()):
                if line["key"] == "file":
                    file = line["value"]
                    data = base64.b64decode(file["content"])
                    self.hub.repositories[found[1]][file["path"]] = data
            commit = self.hub.commit(found[1])
            url = f"{self.url(found[1])}/commit/{commit}"
            self.answer(200, {"commitUrl": url, "commitOid": commit})
        else:
            self.answer(404)

    def url(self, name):
        return f"http://127.0.0.1:{self.server.server_port}/{name}"


def _faults(card):
    """Return what the hub would refuse of a card: no front matter, no YAML, other types."""
    try:
        facts = yaml.safe_load(card.split("---\n")[1])
    except (yaml.YAMLError, IndexError) as error:
        return [{"message": str(error)}]
    kinds = {"library_name": str, "pipeline_tag": str, "tags": list}
    return [
        {"message": name} for name, kind in kinds.items() if not isinstance(facts.get(name), kind)
    ]


@contextlib.contextmanager
def serve():
    """Run a stand-in; give it and its address."""
    hub = Hub()
    server = ThreadingHTTPServer(("127.0.0.1", 0), type("Handler", (_Handler,), {"hub": hub}))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield hub, f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
