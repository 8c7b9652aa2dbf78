#include "interneuron/security.h"

#include <sodium.h>

#include "interneuron/transport.h"
#include "node/io/random.h"

namespace interneuron {

void io::start_crypto() {
  // 1: it was ready already.
  if (::sodium_init() < 0) {
    throw IoError("libsodium cannot be used: the system gives it no random bytes", 0);
  }
}

SecretKey random_key() {
  io::start_crypto();
  SecretKey out;
  ::randombytes_buf(out.writable().data(), out.writable().size());
  return out;
}

}  // namespace interneuron
