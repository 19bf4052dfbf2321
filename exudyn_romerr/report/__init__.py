"""What a run has found: data, words, files, pictures. Nothing here knows how it was computed."""
