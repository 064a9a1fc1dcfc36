// Whether a node of our name runs already: the master would end it as soon as we register.
#pragma once

namespace rbpf_node {

// To be called between ros::init() and the first node handle. Waits for the master, as these do.
// Throws std::runtime_error, with where the other one runs. One that was killed stays registered,
// but nobody listens there any more.
void expectNameIsFree();

}  // namespace rbpf_node
