#!/bin/bash
# Makes scenes to train on for ever, at the lowest priority: scenes.sh PROGRAM FOLDER [MOST]. Of twenty scenes nine are of the family as
# drawn, seven measured as published captures are, four ideal. Waits while MOST (1500) are there; train.py --uses removes those it used.
set -e
program=$1 folder=$2 most=${3:-1500}
mkdir -p "$folder"
export RAYON_NUM_THREADS=${RAYON_NUM_THREADS:-1}
round=$(cat "$folder/round" 2>/dev/null || echo 0)
make() { # kind, first seed, scenes a round, options
    local from=$(($2 + round * $3))
    nice -n 19 "$program" simulate "${@:4}" "$from..$((from + $3))" --coarse --inputs --out "$folder/$1" -q
    rm -f "$folder/$1"/c*.npz # captures: the network sees i*.npy alone
}
while true; do
    while [ "$(find "$folder" -name 's*.json' | wc -l)" -ge "$most" ]; do sleep 20; done
    make drawn 10000000 9 --family
    make measured 20000000 7 --measured
    make ideal 30000000 4 --ideal --family
    round=$((round + 1))
    echo "$round" > "$folder/round"
done
