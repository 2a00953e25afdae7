# To be sourced. Installs the packages that build and drive the viewer into target/foreign/viewer, unless these very ones are there.
install_viewer() {
    local sources=client/web/viewer work=target/foreign/viewer
    if ! command -v npm > /dev/null; then
        echo 'SKIPPED: the viewer in a browser: there is no npm'
        return
    fi
    if cmp --silent "$sources/package-lock.json" "$work/installed.json"; then return; fi
    mkdir -p "$work"
    cp "$sources/package.json" "$sources/package-lock.json" "$work/"
    if npm ci --prefix "$work" --no-audit --no-fund --silent; then
        cp "$sources/package-lock.json" "$work/installed.json"
    else
        echo 'SKIPPED: the viewer in a browser: its packages cannot be installed'
    fi
}
