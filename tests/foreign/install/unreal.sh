# To be sourced. Gets a C++ compiler, gRPC for C++ and its code generator, with which the Unreal plugin is compiled and tested.
install_unreal() {
    if command -v g++ > /dev/null && command -v pkg-config > /dev/null && command -v grpc_cpp_plugin > /dev/null &&
        [ -e /usr/include/grpcpp/grpcpp.h ] && [ -e /usr/include/google/protobuf/descriptor.proto ]; then return; fi
    if [ "$(id -u)" != 0 ] || ! command -v apt-get > /dev/null ||
        ! { apt-get update -qq && apt-get install -y -qq --no-install-recommends g++ pkg-config libgrpc++-dev libprotobuf-dev \
            protobuf-compiler protobuf-compiler-grpc > /dev/null; }; then
        echo 'SKIPPED: the Unreal plugin: there is no g++ or gRPC for C++, and they cannot be installed'
    fi
}
