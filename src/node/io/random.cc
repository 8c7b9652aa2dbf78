#include "interneuron/security.h"

#include <sodium.h>

#include "interneuron/transport.h"

namespace interneuron {

SecretKey random_key() {
  // 1: it was ready already.
  if (::sodium_init() < 0) {
    throw IoError("libsodium cannot be used: the system gives it no random bytes", 0);
  }
  SecretKey out;
  ::randombytes_buf(out.writable().data(), out.writable().size());
  return out;
}

}  // namespace interneuron
