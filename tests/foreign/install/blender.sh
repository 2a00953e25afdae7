# To be sourced. Installs Blender as a Python module, which is made for one version of Python, into target/foreign/blender.
install_blender() {
    local folder=target/foreign/blender packages="bpy==5.0.1 pytest==9.2.0 pyyaml==6.0.3"
    if [ "$(cat "$folder/installed.txt" 2> /dev/null)" = "$packages" ]; then return; fi
    if ! command -v python3.11 > /dev/null; then
        echo 'SKIPPED: Blender: bpy 5.0 needs Python 3.11'
        return
    fi
    mkdir -p "$folder"
    # shellcheck disable=SC2086
    if python3.11 -m venv "$folder/venv" && "$folder/venv/bin/pip" install --quiet --disable-pip-version-check $packages &&
        "$folder/venv/bin/python" -c 'import bpy'; then
        echo "$packages" > "$folder/installed.txt"
    else
        echo 'SKIPPED: Blender: bpy cannot be installed or does not start'
    fi
}
