# To be sourced. Installs Python packages into FOLDER/venv, unless these very ones are there; exits with 77 without Python.
#
#   install_packages FOLDER PACKAGE...
install_packages() {
    local folder=$1
    shift
    if ! command -v python3 > /dev/null; then exit 77; fi
    mkdir -p "$folder"
    if [ "$(cat "$folder/installed.txt" 2> /dev/null)" = "$*" ]; then return; fi
    python3 -m venv "$folder/venv"
    "$folder/venv/bin/pip" install --quiet --disable-pip-version-check "$@"
    echo "$*" > "$folder/installed.txt"
}
