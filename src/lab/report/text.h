// Text as a page and its inlined pictures need it. Pure.
#pragma once

#include <string>

namespace interneuron::report {

// Text between tags or in an attribute.
std::string escaped(const std::string& text);

// Bytes by RFC 4648, for addresses that begin with "data:".
std::string base64(const std::string& bytes);

}  // namespace interneuron::report
