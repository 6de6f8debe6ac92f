#!/usr/bin/env bash
# Makes the tables and pictures of docs/accuracy.md anew:
#
#     scripts/figures.sh              all of them (about half an hour on two cores)
#     scripts/figures.sh centres      those of these names
#
# A table stands between two comments, the first of which holds its name and its command:
#
#     <!-- table NAME: COMMAND -->
#     ... what the command printed: its lines that begin with | or > ...
#     <!-- end of NAME -->
#
# Under it stands the commit that it was made with. A command runs in the top folder; what it writes goes to target/figures.
set -euo pipefail
cd "$(dirname "$0")/.."
page=docs/accuracy.md
mkdir -p target/figures

commit=$(git rev-parse --short=12 HEAD 2>/dev/null || echo unknown)
[ -z "$(git status --porcelain --untracked-files=no 2>/dev/null | grep -v ' docs/' || true)" ] || commit="$commit, with changes"

names=$(sed -n 's/^<!-- table \([a-z_]*\): .*-->$/\1/p' "$page")
for name in ${*:-$names}; do
    grep -qx "$name" <<<"$names" || { echo "figures: no table \"$name\" in $page; there are: ${names//$'\n'/, }" >&2; exit 2; }
    command=$(sed -n "s/^<!-- table $name: \(.*\) -->\$/\1/p" "$page")
    echo "figures: $name: $command" >&2
    bash -c "$command" >"target/figures/$name.txt" || { echo "figures: $name failed; $page keeps the table it had" >&2; exit 1; }
    awk '/^[|>]/ { print; open = 1; next } open { print ""; open = 0 }' "target/figures/$name.txt" |
        sed -e :a -e '/^\n*$/{$d;N;ba' -e '}' >"target/figures/$name.md"
    [ -s "target/figures/$name.md" ] || { echo "figures: $name printed no table; $page keeps the one it had" >&2; exit 1; }
    printf '\nMade at commit %s, on %s cores.\n' "$commit" "$(nproc)" >>"target/figures/$name.md"
    awk -v name="$name" -v table="target/figures/$name.md" '
        index($0, "<!-- table " name ": ") == 1 { print; while ((getline line < table) > 0) print line; skip = 1; next }
        $0 == "<!-- end of " name " -->" { skip = 0 }
        !skip' "$page" >"target/figures/page.md"
    # Whole or not at all.
    cp target/figures/page.md "$page.new" && mv "$page.new" "$page"
done
