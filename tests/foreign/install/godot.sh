# To be sourced. Unpacks Godot 4 of Debian's unstable distribution, with every library that it loads, below target/foreign/godot: the
# system stays as it is, and target/foreign/godot/godot starts it. Its pictures also need Xvfb, which root gets by name.
install_godot() {
    local folder=$PWD/target/foreign/godot
    local keys=/usr/share/keyrings/debian-archive-keyring.gpg
    local mirror package machine
    if [ ! -x "$folder/godot" ]; then
        if ! command -v apt-get > /dev/null || [ ! -e "$keys" ]; then
            echo 'SKIPPED: Godot: this is not Debian'
            return
        fi
        # The mirror that this machine uses.
        find_mirror() { apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' | grep --max-count=1 '/debian/$'; }
        mirror=$(find_mirror || { apt-get update -qq && find_mirror; } || true)
        if [ -z "$mirror" ]; then
            echo 'SKIPPED: Godot: apt has no list of Debian'
            return
        fi
        rm -rf "$folder"
        mkdir -p "$folder"/apt/{lists,cache/archives,state}/partial
        touch "$folder/apt/status"
        echo "deb [signed-by=$keys] $mirror sid main" > "$folder/apt/sources.list"
        # A Debian of its own, in which nothing is installed yet.
        cat > "$folder/apt/conf" << EOF
Dir::Etc::SourceList "$folder/apt/sources.list";
Dir::Etc::SourceParts "/dev/null";
Dir::State "$folder/apt/state";
Dir::State::Lists "$folder/apt/lists";
Dir::State::Status "$folder/apt/status";
Dir::Cache "$folder/apt/cache";
APT::Sandbox::User "";
Acquire::Languages "none";
EOF
        if ! APT_CONFIG="$folder/apt/conf" apt-get update -qq ||
            ! APT_CONFIG="$folder/apt/conf" apt-get install -y -qq --no-install-recommends --download-only \
                godot libgl1 libgl1-mesa-dri > /dev/null; then
            echo 'SKIPPED: Godot: its packages cannot be downloaded'
            return
        fi
        for package in "$folder"/apt/cache/archives/*.deb; do dpkg-deb --extract "$package" "$folder/root"; done
        rm -r "$folder/apt"
        machine=$(uname -m)-linux-gnu
        cat > "$folder/godot.part" << EOF
#!/bin/sh
# Starts Godot by the loader and with the libraries that came with it.
root=\$(dirname "\$(realpath "\$0")")/root
libraries=\$root/usr/lib/$machine
export LIBGL_DRIVERS_PATH=\$libraries/dri
export __EGL_VENDOR_LIBRARY_DIRS=\$root/usr/share/glvnd/egl_vendor.d
export XKB_CONFIG_ROOT=\$root/usr/share/X11/xkb
exec "\$libraries"/ld-linux-*.so.* --library-path "\$libraries:\$libraries/pulseaudio" "\$root/usr/bin/godot" "\$@"
EOF
        chmod +x "$folder/godot.part"
        if ! "$folder/godot.part" --version; then
            echo 'SKIPPED: Godot: it does not start here'
            return
        fi
        mv "$folder/godot.part" "$folder/godot"
    fi
    if ! command -v xvfb-run > /dev/null; then
        if [ "$(id -u)" != 0 ] || ! { apt-get update -qq && apt-get install -y -qq --no-install-recommends xvfb xauth > /dev/null; }; then
            echo 'SKIPPED: pictures of Godot: there is no Xvfb, and it cannot be installed'
        fi
    fi
}
