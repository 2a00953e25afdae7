# To be sourced. Installs the packages for tests of the Python package into target/foreign/python: a virtual environment to
# check it in, and the wheels from which pip installs it into a fresh one.
install_python() {
    if ! bash -euo pipefail -c '
        work=target/foreign/python
        source tests/python.sh
        # protobuf 6 here and 7 among the wheels: the package runs with both.
        install_packages "$work" build==1.6.1 googleapis-common-protos==1.76.0 grpcio==1.85.1 grpcio-tools==1.76.0 \
            hatchling==1.33.0 mypy==2.4.1 numpy==2.4.6 protobuf==6.33.6 pytest==9.2.0 trimesh==5.2.0 types-grpcio==1.85.0.20261028 \
            types-protobuf==7.35.1.20260906 typing-extensions==4.16.0 viser==1.1.1
        wheels="googleapis-common-protos==1.76.0 grpcio==1.85.1 numpy==2.4.6 protobuf==7.36.2 typing-extensions==4.16.0
            trimesh==5.2.0 viser==1.1.1"
        backend="hatchling==1.33.0 grpcio-tools==1.76.0"
        if [ "$(cat "$work/wheels.txt" 2> /dev/null)" != "$wheels $backend" ]; then
            for set in "$wheels" "$backend"; do
                # shellcheck disable=SC2086
                "$work/venv/bin/pip" download --quiet --disable-pip-version-check --dest "$work/wheels" $set
            done
            echo "$wheels $backend" > "$work/wheels.txt"
        fi
    '; then
        echo 'SKIPPED: the Python package: its packages cannot be installed'
    fi
}
