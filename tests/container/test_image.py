"""What the image is, before it runs."""

import os
import shutil
import subprocess

from conftest import ENGINE, IMAGE, ROOT, engine, inspect, measured, run

LARGEST_IMAGE = 60_000_000


def test_the_images_are_small():
    for image in (IMAGE, "grasp-client"):
        size = int(engine("image", "inspect", "--format", "{{.Size}}", image))
        measured(f"size of the image {image}", f"{size / 1e6:.1f} MB")
        assert 1_000_000 < size < LARGEST_IMAGE


def test_the_image_says_how_it_is_run():
    user = engine("image", "inspect", "--format", "{{.Config.User}}", IMAGE).split(":")[0]
    # A number, because Kubernetes' runAsNonRoot knows no names.
    assert user.isdigit() and int(user) > 0
    assert "50051/tcp" in engine("image", "inspect", "--format", "{{.Config.ExposedPorts}}", IMAGE)
    health = engine("image", "inspect", "--format", "{{.Config.Healthcheck}}", IMAGE)
    assert "CMD /grasp-server --health-check" in health and "CMD-SHELL" not in health
    labels = engine("image", "inspect", "--format", "{{.Config.Labels}}", IMAGE)
    assert "org.opencontainers.image.licenses:MIT OR Apache-2.0" in labels


def test_there_is_no_shell():
    for shell in ("/bin/sh", "/bin/bash", "/busybox/sh"):
        assert run(ENGINE, "run", "--rm", "--entrypoint", shell, IMAGE, "-c", "true").returncode != 0


def test_a_changed_source_file_does_not_build_the_dependencies_again(tmp_path):
    context = tmp_path / "context"
    # Not by git, which may not be there: everything but what is generated.
    ignored = shutil.ignore_patterns("target", ".git", "node_modules", "__pycache__")
    shutil.copytree(ROOT, context, ignore=ignored)

    def build():
        """The identity of the layer with the dependencies."""
        tag = f"grasp-dependencies-{os.getpid()}"
        arguments = ["--file", "docker/Dockerfile", "--target", "dependencies", "--tag", tag, "."]
        done = subprocess.run(["docker", "build", *arguments], cwd=context, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        identity = inspect(tag, "{{.Id}}")
        engine("rmi", "--no-prune", tag) if ENGINE == "docker" else engine("untag", tag)
        return identity

    before = build()
    for source in ("server/src/lib.rs", "client/src/main.rs", "server/src/answer.rs"):
        with (context / source).open("a") as file:
            file.write("// A comment more.\n")
    (context / "server/src/another.rs").write_text("//! A file more.\n")
    assert build() == before
