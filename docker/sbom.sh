#!/bin/sh
# Prints the bill of materials of a program, in the JSON of CycloneDX 1.5: every crate that is linked into it, with its version,
# licence and checksum.
#
#     docker/sbom.sh PACKAGE TARGET [FEATURES]
set -eu
cargo tree --locked --package "$1" --target "$2" --features "${3:-}" --edges normal,no-proc-macro --prefix none --no-dedupe \
    --format '{p}|{l}' > /tmp/sbom-crates.$$
trap 'rm -f /tmp/sbom-crates.$$' EXIT
sort -u /tmp/sbom-crates.$$ | awk -F '|' -v program="$1" '
    # First the checksums in the lock file, then the crates.
    FILENAME == "Cargo.lock" {
        split($0, part, "\"")
        if (/^name = /) name = part[2]
        if (/^version = /) version = part[2]
        if (/^checksum = /) checksum[name "@" version] = part[2]
        next
    }
    {
        split($1, word, " ")
        name = word[1]
        version = substr(word[2], 2)
        licence = $2
        gsub("/", " OR ", licence)
        gsub(/  +/, " ", licence)
        purl = "pkg:cargo/" name "@" version
        text = sprintf("\"name\": \"%s\", \"version\": \"%s\", \"purl\": \"%s\", \"bom-ref\": \"%s\"", name, version, purl, purl)
        if (licence != "") text = text sprintf(", \"licenses\": [{\"expression\": \"%s\"}]", licence)
        hash = checksum[name "@" version]
        if (hash != "") text = text sprintf(", \"hashes\": [{\"alg\": \"SHA-256\", \"content\": \"%s\"}]", hash)
        if (name == program) root = text
        else list = list (list == "" ? "" : ",\n") "    {\"type\": \"library\", " text "}"
    }
    END {
        print "{"
        print "  \"bomFormat\": \"CycloneDX\", \"specVersion\": \"1.5\", \"version\": 1,"
        print "  \"metadata\": {\"component\": {\"type\": \"application\", " root "}},"
        print "  \"components\": [\n" list "\n  ]"
        print "}"
    }' Cargo.lock -
