# SPDX-License-Identifier: Apache-2.0
# What the shell scripts share: . "$(dirname "$0")/usage.sh" prints the comment at the script's head for --help, and ends it.
# Then refuse_argument WORD ends it with one line of error, refuse_arguments "$@" does for the first word there is, and refuse_options "$@" for the first
# that begins with a dash.
refuse_argument() {
  echo "${0##*/}: unknown argument \"$1\": see scripts/${0##*/} --help" >&2
  exit 2
}
refuse_arguments() { [ $# -eq 0 ] || refuse_argument "$1"; }
refuse_options() {
  for word in "$@"; do
    case "$word" in -*) refuse_argument "$word" ;; esac
  done
}
case "${1:-}" in
  -h | --help)
    sed -n '/^#!/d; /^# SPDX-/d; /^#/!q; s/^# \{0,1\}//p' "$0"
    exit 0
    ;;
esac
