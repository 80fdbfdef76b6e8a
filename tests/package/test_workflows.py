"""The workflows on GitHub: a tag of an action can be moved to other code, a commit cannot."""

import re

import pytest
from common.paths import ROOT

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


@pytest.mark.parametrize("file", WORKFLOWS, ids=lambda file: file.name)
def test_actions_are_named_by_commit_with_the_tag_as_comment(file) -> None:
    uses = re.findall(r"uses: (.*)", file.read_text(encoding="utf-8"))
    assert uses
    for action in uses:
        assert re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", action), action


def test_the_runner_gets_what_ci_installs_only_as_root() -> None:
    scripts = [file.read_text(encoding="utf-8") for file in (ROOT / ".ci").iterdir()]
    wanted = {
        name
        for script in scripts
        for line in re.findall(r"apt-get install ([^)>]*)", script)
        for name in line.split()
        if not name.startswith("-")
    }
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    # Ubuntu's name of the browser.
    assert wanted and wanted - {"chromium"} <= set(workflow.split())


def test_both_what_users_and_what_clones_get_is_audited() -> None:
    workflow = (ROOT / ".github" / "workflows" / "advisories.yml").read_text(encoding="utf-8")
    compiled = re.findall(r"uv pip compile (.*?)--output-file (\S+)", workflow)
    assert ["--no-config" in options for options, _ in compiled] == [True, False]
    for _, file in compiled:
        assert f"--requirement {file}" in workflow
