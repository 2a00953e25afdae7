# The web client's packages, beside a copy of its sources.
install_web_package() {
    local folder=target/foreign/web_package/client/web
    mkdir -p "$folder"
    if cmp --silent client/web/package.json "$folder/installed.json"; then return; fi
    cp client/web/package.json "$folder/"
    if npm install --prefix "$folder" --ignore-scripts --no-audit --no-fund --silent; then
        cp client/web/package.json "$folder/installed.json"
    else
        echo 'SKIPPED: the web client: its packages cannot be fetched'
    fi
}
