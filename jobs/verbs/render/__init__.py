"""Pictures of scenes: `twillight render`.

render is the verb; look reads its options; film_maker makes frames on all cores and writes them. The pictures come from
pipeline.scenes.picture.
"""
