"""Contact states: clustering of demonstrations, on-line filter, graph, names and colours."""
