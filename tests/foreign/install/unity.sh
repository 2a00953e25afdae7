# To be sourced. Gets Mono and protoc, with which the Unity package is compiled and tested.
install_unity() {
    if command -v mcs > /dev/null && command -v protoc > /dev/null && [ -e /usr/lib/mono/4.5/System.Net.Http.dll ] &&
        [ -e /usr/include/google/protobuf/descriptor.proto ]; then return; fi
    if [ "$(id -u)" != 0 ] || ! command -v apt-get > /dev/null ||
        ! { apt-get update -qq && apt-get install -y -qq --no-install-recommends mono-mcs mono-runtime \
            libmono-system-net-http4.0-cil protobuf-compiler libprotobuf-dev > /dev/null; }; then
        echo 'SKIPPED: the Unity package: there is no Mono or protoc, and they cannot be installed'
    fi
}
