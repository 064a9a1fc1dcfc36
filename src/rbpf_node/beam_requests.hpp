// How the map nodes' requests for beams are checked and answered: all of a reply but the epoch and
// success, which is an empty message.
#pragma once

#include "rbpf_core/particle_filter.hpp"
#include "rbpf_svgp_slam/GetBeams.h"
#include "rbpf_svgp_slam/GetMinibatches.h"

namespace rbpf_node {

void answer(const rbpf_core::ParticleFilter& filter,
            const rbpf_svgp_slam::GetMinibatches::Request& request,
            rbpf_svgp_slam::GetMinibatches::Response* response);

void answer(const rbpf_core::ParticleFilter& filter,
            const rbpf_svgp_slam::GetBeams::Request& request,
            rbpf_svgp_slam::GetBeams::Response* response);

}  // namespace rbpf_node
