#pragma once

#include <string>
#include <string_view>

namespace fiducap::test {

/// Whether a text is XML as far as our own writers go: elements that nest, attributes that are
/// quoted and not given twice, the five entities, one root, no control characters. A document type
/// may stand before it.
/// @return what is wrong and where; empty: nothing
[[nodiscard]] std::string xml_fault(std::string_view text);

}  // namespace fiducap::test
