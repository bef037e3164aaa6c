#!/usr/bin/env bash
# The examples, for the scripts of this folder: run_examples FOLDER runs those in FOLDER and checks a figure of each.
bad=0

# expect_near WHAT FOUND LEAST MOST
expect_near() {
    if ! awk -v x="$2" -v lo="$3" -v hi="$4" 'BEGIN { exit !(x + 0 == x && x >= lo && x <= hi) }'; then
        echo "$1: found '$2', expected between $3 and $4"
        bad=1
    fi
}

check_study() {
    local text
    text="$("$1/example_study")"
    # Sixteen gyros for five minutes: a quarter of a per cent of the random walk; ten times that is allowed.
    expect_near "random walk over theory" "$(sed -n 's/^noise_injected  *.*, \([0-9.]*\) of theory$/\1/p' <<<"$text")" \
        0.975 1.025
}
check_allan() {
    local text
    text="$("$1/example_allan")"
    # Its standard error is 0.12 %; four are allowed.
    expect_near "random walk put in" \
        "$(sed -n 's/^angle random walk N: \([0-9.]*\) .*/\1/p' <<<"$text")" 0.00995 0.01005
}
check_closed_loop() {
    local text
    text="$("$1/example_closed_loop")"
    # Its standard error is 0.0174; four are allowed.
    expect_near "asymmetry put in" "$(sed -n 's/^  ratio = \([0-9.]*\) .*/\1/p' <<<"$text")" 0.13 0.27
    if [[ $text != *"lockin_turn_asymmetry"* ]]; then
        echo "closed_loop does not name the effect: $text"
        bad=1
    fi
}
check_own_device() {
    local text theory
    text="$("$1/example_own_device")"
    # ARW = Omega_L sqrt(K/(2 pi Omega_D)) of a gyro with K = 1.8 arcsec, Omega_L = 200 deg/h, Omega_D = 120 deg/s, to
    # first order in the kick; the second is some per cent.
    theory="$(sed -n 's/^prototype  .*theory \([0-9.]*\)$/\1/p' <<<"$text")"
    expect_near "random walk of theory" "$theory" 0.0024 0.0030
    expect_near "random walk of the better mirrors" \
        "$(sed -n 's/^prototype with .* \([0-9.]*\) deg.*/\1/p' <<<"$text")" 0.0006 0.0008
}

run_examples() {
    local folder
    folder="$(mktemp -d)"
    (
        cd "$folder"
        for example in study allan closed_loop own_device; do "check_$example" "$1"; done
        exit "$bad"
    ) || bad=1
    rm -rf "$folder"
}
