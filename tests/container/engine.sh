# Finds a container engine, a build image and run options that work here. Sourced by tests/container/run, which sets
# `work`.
# Functions that fail leave the reason in `problem`.
# shellcheck shell=bash disable=SC2034 # The results are used by the script that sources this one.

engine=
compose=
no_compose=
build_image=
problem=

# Installs Debian packages by name, as root only.
install() {
    if [ "$(id -u)" != 0 ] || ! command -v apt-get > /dev/null; then
        return 1
    fi
    echo "installing $*"
    # On a fresh machine the package lists may be missing or too old.
    local get=(env DEBIAN_FRONTEND=noninteractive apt-get)
    "${get[@]}" install --yes --no-install-recommends "$@" > "$work/apt.log" 2>&1 \
        || { "${get[@]}" update && "${get[@]}" install --yes --no-install-recommends "$@"; } > "$work/apt.log" 2>&1
}

find_engine() {
    if command -v docker > /dev/null && timeout 20 docker info > /dev/null 2>&1; then
        engine=docker
        if docker compose version > /dev/null 2>&1; then
            compose="$(command -v docker) compose"
        elif command -v docker-compose > /dev/null; then
            compose=$(command -v docker-compose)
        else
            no_compose='no docker compose'
        fi
        return
    fi
    if ! command -v podman > /dev/null; then
        # The bridge and name service of either network stack, whichever the distribution has.
        install podman runc iptables containernetworking-plugins golang-github-containernetworking-plugin-dnsname \
            || install podman runc iptables netavark aardvark-dns \
            || { problem='no docker daemon answers, and there is no podman and no way to install it'; return 1; }
    fi
    engine=podman
    if command -v podman-compose > /dev/null || install podman-compose; then
        compose=$(command -v podman-compose)
    else
        no_compose='no podman-compose, and no way to install it'
    fi
}

# The build image: GRASP_BUILD_IMAGE, else the Dockerfile's default if it can be pulled, else one made here.
find_build_image() {
    build_image=${GRASP_BUILD_IMAGE:-}
    if [ -n "$build_image" ]; then
        return
    fi
    build_image=$(sed -n 's/^ARG BUILD_IMAGE=//p' docker/Dockerfile)
    if "$engine" image inspect "$build_image" > /dev/null 2>&1 \
        || timeout 300 "$engine" pull --quiet "$build_image" > "$work/pull.log" 2>&1; then
        return
    fi
    echo "no image registry reachable: $(tail -1 "$work/pull.log")"
    # The image contains the crates that the lock file names, and this toolchain.
    build_image=localhost/grasp-build:$(cat Cargo.lock tests/container/make-build-image <(rustc --version --verbose) \
        | sha256sum | cut -c1-16)
    if "$engine" image inspect "$build_image" > /dev/null 2>&1; then
        return
    fi
    if [ "$(id -u)" != 0 ]; then
        problem='no image registry reachable, and only root can make a build image'
        return 1
    fi
    echo 'making a build image from Debian packages and the installed toolchain'
    command -v mmdebstrap > /dev/null || install mmdebstrap \
        || { problem='no image registry reachable, and no mmdebstrap to make a build image with'; return 1; }
    tests/container/make-build-image "$engine" "$build_image" "$work" > "$work/build-image.log" 2>&1 \
        || { problem="cannot make a build image: $(tail -1 "$work/build-image.log")"; return 1; }
}

# On some machines an engine may not raise resource limits as it does by default, or its default runtime does not work.
# podman gets a configuration file with the first combination that works; docker's daemon has its own. The arguments are what to
# try: options, an image and its command.
find_run_options() {
    local runs=("$engine" run --rm "$@")
    if "${runs[@]}" > "$work/run.log" 2>&1; then
        return
    fi
    local first
    first=$(tail -1 "$work/run.log")
    if [ "$engine" = podman ]; then
        command -v runc > /dev/null || install runc || true
        export CONTAINERS_CONF=$work/containers.conf
        local limits
        limits="default_ulimits = [\"nofile=$(limit -n):$(limit -n)\", \"nproc=$(limit -u):$(limit -u)\"]"
        for engine_options in '' 'runtime = "runc"'; do
            for container_options in '' "$limits"; do
                printf '[containers]\n%s\n[engine]\n%s\n' "$container_options" "$engine_options" > "$CONTAINERS_CONF"
                if "${runs[@]}" > "$work/run.log" 2>&1; then
                    return
                fi
            done
        done
    fi
    problem="$engine cannot run a container here: $first"
    return 1
}

# The resource limit for containers: this process' hard limit, but no more than a container needs.
limit() {
    local hard
    hard=$(ulimit -H "$1")
    if [ "$hard" = unlimited ] || [ "$hard" -gt 4096 ]; then hard=4096; fi
    echo "$hard"
}
