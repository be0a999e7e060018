"""Policies on the Hugging Face hub: a model repository with a policy file and its card.

The hub reads the card's front matter (YAML), which is made from what the policy file says of
itself; policies are found by the tag ``TAG``. One that comes from there is a stranger's file: it is
refused before it is downloaded if it is too large, and checked as every policy file is.
"""

import contextlib
import json
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from huggingface_hub import CommitOperationAdd, HfApi
from huggingface_hub.errors import (
    HfHubHTTPError,
    HFValidationError,
    RepositoryNotFoundError,
    RevisionNotFoundError,
)

from hopping_leg.controllers.policy import Card, Policy
from hopping_leg.controllers.registry import shipped_card, shipped_policies
from hopping_leg.errors import HoppingLegError, PolicyError

TAG = "hopping-leg"
POLICY, CARD = "policy.onnx", "README.md"
"""Names of the files in a repository."""

LARGEST = 1 << 26
"""Largest policy file that is downloaded, bytes; the shipped ones take a hundredth."""

_FENCE = "---\n"


@dataclass(frozen=True)
class Pulled:
    """A policy from the hub."""

    policy: Policy
    card: str
    """Its card, Markdown; empty where there is none."""
    commit: str


def front_matter(card: Card) -> str:
    """Return what the hub reads at the beginning of a model card, fences included."""
    facts = {
        "library_name": TAG,
        "pipeline_tag": "robotics",
        "tags": [TAG, "onnx", "legged-locomotion", f"recipe:{card.recipe}", f"robot:{card.robot}"],
    }
    # Every JSON value is YAML.
    return _FENCE + "".join(f"{k}: {json.dumps(v)}\n" for k, v in facts.items()) + _FENCE


def hub_card(policy: Policy) -> str:
    """Return a policy's card for the hub: that beside its file, or that of a shipped one.

    Raises:
        PolicyError: There is none.
    """
    if policy.name in shipped_policies() and not Path(policy.origin).exists():
        text = shipped_card(policy.name)
    else:
        folder = Path(policy.origin).parent
        names = (folder / "model_card.md", folder / CARD, Path(policy.origin).with_suffix(".md"))
        found = next((path for path in names if path.is_file()), None)
        if found is None:
            raise PolicyError(
                f"{policy.origin} has no card; put a model_card.md beside it, as `hop train` does."
            )
        text = found.read_text(encoding="utf-8")
    return text if text.startswith(_FENCE) else front_matter(policy.card) + text


def push(policy: Policy, repository: str, *, private: bool = False) -> str:
    """Upload a policy and its card; return the address of the commit.

    Raises:
        PolicyError: The policy has no card, or the hub refuses.
    """
    files = {POLICY: policy.content, CARD: hub_card(policy).encode()}
    operations = [CommitOperationAdd(name, content) for name, content in files.items()]
    message = f"{policy.name}, {policy.digest}"
    with _hub(repository) as api:
        api.create_repo(repository, private=private or None, exist_ok=True)
        return str(api.create_commit(repository, operations, commit_message=message).commit_url)


def pull(repository: str, revision: str = "main") -> Pulled:
    """Download and check a policy.

    Raises:
        PolicyError: There is none, it is too large, or it is no policy that this version can run.
    """
    with _hub(repository) as api, tempfile.TemporaryDirectory() as folder:
        about = api.model_info(repository, revision=revision, files_metadata=True)
        sizes = {file.rfilename: file.size or 0 for file in about.siblings or []}
        if POLICY not in sizes:
            raise PolicyError(f"{repository} holds no {POLICY}, so that it is no policy of ours.")
        contents = {}
        for name in {POLICY, CARD} & sizes.keys():
            if sizes[name] > LARGEST:
                raise PolicyError(
                    f"{name} of {repository} takes {sizes[name] >> 20} MiB; policies take at most"
                    f" {LARGEST >> 20} MiB, so that it is not downloaded."
                )
            file = api.hf_hub_download(repository, name, revision=about.sha, local_dir=folder)
            contents[name] = Path(file).read_bytes()
    origin = f"{POLICY} of {repository}"
    policy = Policy(contents[POLICY], origin, repository.rpartition("/")[2])
    card = contents.get(CARD, b"").decode("utf-8", errors="replace")
    return Pulled(policy, card, str(about.sha))


def search() -> list[dict[str, Any]]:
    """Return the policies on the hub, the newest first.

    Raises:
        PolicyError: The hub cannot be reached.
    """
    with _hub("the hub") as api:
        return [
            {"repository": model.id, "changed": str(model.last_modified or "")[:10]}
            for model in api.list_models(filter=TAG, sort="last_modified")
        ]


@contextlib.contextmanager
def _hub(repository: str) -> Iterator[HfApi]:
    """Give the hub, and say in a sentence what it refuses."""
    api = HfApi()
    try:
        yield api
    except HoppingLegError:
        raise
    except HFValidationError as error:
        raise PolicyError(f"'{repository}' is no repository's name; give OWNER/NAME.") from error
    except RevisionNotFoundError as error:
        raise PolicyError(f"{repository} has no such branch, tag or commit.") from error
    except RepositoryNotFoundError as error:
        raise PolicyError(
            f"There is no {repository} on {api.endpoint}, or it is private and your token does not"
            " open it; `hf auth login` stores one."
        ) from error
    except HfHubHTTPError as error:
        code = error.response.status_code
        login = "; `hf auth login` stores a token that may write" if code in (401, 403) else ""
        raise PolicyError(f"{api.endpoint} refused with code {code}{login}.") from error
    except Exception as error:  # the client raises many unrelated types
        raise PolicyError(f"Could not use {repository} on {api.endpoint}: {error}") from error
