#!/bin/sh
# Posts a summary of compare.sh on a pull request, or updates the comment that an earlier one is:
#
#     comment.sh SUMMARY OWNER/REPOSITORY NUMBER
#
# Needs `gh`, the command-line program of GitHub, with a token that may write comments.
set -eu
summary=$1 comments=repos/$2/issues
mark=$(head -n 1 "$summary")
known=$(gh api --paginate "$comments/$3/comments" \
    --jq '.[] | [.id, (.body | split("\n")[0])] | @tsv' | tr -d '\r')
id=$(printf '%s\n' "$known" | awk -F '\t' -v mark="$mark" '$2 == mark { print $1; exit }')
if [ -n "$id" ]; then
    gh api --method PATCH "$comments/comments/$id" --field "body=@$summary" > /dev/null
else
    gh api --method POST "$comments/$3/comments" --field "body=@$summary" > /dev/null
fi
