// Random bytes of the system, by libsodium: keys, seeds. interneuron::random_key() of security.h is
// here, too. Thread-safe.
#pragma once

#include "interneuron/security.h"

namespace interneuron::io {

// Makes libsodium ready, which must be before anything else is asked of it. May be called again.
// Throws IoError.
void start_crypto();

}  // namespace interneuron::io
