"""The studies beside the pipeline: what each part of a policy's recipe is worth."""
