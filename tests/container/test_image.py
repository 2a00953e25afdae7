"""Inspects the images without running the service."""

import os
import shutil
import subprocess

from conftest import ENGINE, IMAGE, ROOT, engine, inspect, report_figure, run, skip

# Bytes.
LARGEST_IMAGE = 60_000_000


def test_images_are_small():
    for image in (IMAGE, "grasp-client"):
        size = int(engine("image", "inspect", "--format", "{{.Size}}", image))
        report_figure(f"size of the image {image}", f"{size / 1e6:.1f} MB")
        assert 1_000_000 < size < LARGEST_IMAGE


def test_image_declares_user_port_health_check_and_licence():
    user = engine("image", "inspect", "--format", "{{.Config.User}}", IMAGE).split(":")[0]
    # Kubernetes' runAsNonRoot needs a number.
    assert user.isdigit() and int(user) > 0
    assert "50051/tcp" in engine("image", "inspect", "--format", "{{.Config.ExposedPorts}}", IMAGE)
    health = engine("image", "inspect", "--format", "{{.Config.Healthcheck}}", IMAGE)
    assert "CMD /grasp-server --health-check" in health and "CMD-SHELL" not in health
    labels = engine("image", "inspect", "--format", "{{.Config.Labels}}", IMAGE)
    assert "org.opencontainers.image.licenses:MIT OR Apache-2.0" in labels


def test_image_has_no_shell():
    for shell in ("/bin/sh", "/bin/bash", "/busybox/sh"):
        assert run(ENGINE, "run", "--rm", "--entrypoint", shell, IMAGE, "-c", "true").returncode != 0


def test_source_changes_reuse_the_dependency_layer(tmp_path):
    if os.environ["GRASP_PROGRAMS"] != "build":
        skip("the image's layers: only with GRASP_TEST_CASES=all")
    context = tmp_path / "context"
    # Without git, which may be missing.
    ignored = shutil.ignore_patterns("target", ".git", "node_modules", "__pycache__")
    shutil.copytree(ROOT, context, ignore=ignored)

    def build():
        """The id of the dependency layer."""
        tag = f"grasp-dependencies-{os.getpid()}"
        arguments = ["--file", "docker/Dockerfile", "--target", "dependencies", "--tag", tag, "."]
        done = subprocess.run(["docker", "build", *arguments], cwd=context, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        identity = inspect(tag, "{{.Id}}")
        engine("rmi", "--no-prune", tag) if ENGINE == "docker" else engine("untag", tag)
        return identity

    before = build()
    for source in ("server/src/lib.rs", "client/cli/src/main.rs", "server/src/answer.rs"):
        with (context / source).open("a") as file:
            file.write("// Another comment.\n")
    (context / "server/src/another.rs").write_text("//! Another file.\n")
    assert build() == before
