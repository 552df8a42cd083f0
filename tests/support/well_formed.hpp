#pragma once

#include <string>
#include <string_view>

namespace fiducap::test {

/// Checks XML as our own writers produce it: nested elements, quoted unique attributes, the five
/// entities, one root, no control characters; optionally a document type.
/// @return the fault and its place; empty: none
[[nodiscard]] std::string xml_fault(std::string_view text);

}  // namespace fiducap::test
