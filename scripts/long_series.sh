#!/usr/bin/env bash
# A long series of bounces with known truth, as CSV on stdout: μ-e with e = 0.78, μ = 0.2, no spin before, with noise of the size that
# its deviations say. For docs/accuracy.md.
#
#     scripts/long_series.sh ROWS velocities|angles|distances
set -euo pipefail

rows=${1:?how many rows} kind=${2:?velocities, angles or distances}
case $kind in
velocities) columns=incident_vx_m_s,incident_vx_m_s_std,incident_vz_m_s,incident_vz_m_s_std,rebound_vx_m_s,rebound_vx_m_s_std,rebound_vz_m_s,rebound_vz_m_s_std ;;
angles) columns=incident_angle_deg,incident_angle_deg_std,rebound_angle_deg,rebound_angle_deg_std ;;
distances) columns=x0_m,x0_m_std,x_m,x_m_std,launch_speed_m_s,launch_speed_m_s_std ;;
*)
    printf 'long_series: found "%s"; accepted: velocities, angles, distances\n' "$kind" >&2
    exit 2
    ;;
esac

printf '%s\n' "$columns"
awk -v rows="$rows" -v kind="$kind" '
function normal() { return sqrt(-2 * log(1 - rand())) * cos(6.283185307179586 * rand()) }
BEGIN {
    srand(1); e = 0.78; mu = 0.2; s = 2 / 7; g = 9.81; degree = 0.017453292519943295
    for (i = 0; i < rows; i++) {
        theta = (5 + 70 * rand()) * degree
        speed = kind == "distances" ? 1 / sin(theta) : 1.5 + 1.5 * rand()
        a = speed * sin(theta); b = speed * cos(theta)
        impulse = s * a < mu * (1 + e) * b ? s * a : mu * (1 + e) * b
        vx = a - impulse; vz = e * b
        if (kind == "velocities")
            printf "%.5f,0.01,%.5f,0.01,%.5f,0.01,%.5f,0.01\n", a + 0.01 * normal(), -b + 0.01 * normal(), vx + 0.01 * normal(), vz + 0.01 * normal()
        else if (kind == "angles")
            printf "%.4f,0.3,%.4f,0.3\n", theta / degree + 0.3 * normal(), atan2(vx, vz) / degree + 0.3 * normal()
        else
            printf "%.6f,0.0005,%.6f,0.0005,%.6f,0.001\n", a * b / g + 0.0005 * normal(), 2 * vx * vz / g + 0.0005 * normal(), a + 0.001 * normal()
    }
}'
