# The web client's packages, beside a copy of its sources.
install_web_package() {
    local folder=target/foreign/web_package/client/web
    mkdir -p "$folder"
    if ! cmp --silent client/web/package.json "$folder/installed.json"; then
        cp client/web/package.json "$folder/"
        npm install --prefix "$folder" --ignore-scripts --no-audit --no-fund --silent
        cp client/web/package.json "$folder/installed.json"
    fi
}
